"""Water on a body: hulls, the fluid, force laws, wrenches."""
