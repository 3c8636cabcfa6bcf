"""What the force kernels know of a body: a block of doubles.

First a header (the places below), then columns, one number a triangle: column c of triangle i of n stands at
HEADER + c n + i. Columns let a loop over the triangles run in vector registers. Body axes about the centre of
mass.
"""

N_TRIANGLES = 0
RADIUS = 1  # of the sphere about the centre of mass that holds the body [m]
LOCAL_GATE = 2  # 1: faces that advance themselves, 0: faces turned to the motion of the centre
NORMAL_SQUARED = 3  # rho times the law's coefficients [kg/m^3]
SPEED_NORMAL = 4
SPEED_SQUARED = 5
FRICTION = 6
AIR_DENSITY = 7
DISC_AREA = 8
DISC_NORMAL = 9
DISC_CENTRE = 12
SURFACE = 15  # address of the patch around the body, as the bits of a double; 0: still water
WEIGHT_DENSITY = 16  # rho g if the water bears [N/m^3], or 0
SKIN_DENSITY = 17  # rho if the water rubs, or 0
VISCOSITY = 18  # kinematic [m^2/s]
LENGTH = 19  # of the body along the flow, for its Reynolds number [m]
FORWARD = 20  # 1: the load of a face acts ahead of the middle of its wet part, by Rayleigh
VOLUME = 21  # inside the closed mesh [m^3]
VOLUME_CENTRE = 22  # its centroid (3)
HEADER = 25

CORNERS = 0  # a, b, c (9)
AREA = 9
FACES = 10  # from here on as for pieces of faces
COLUMNS = 16

# columns of faces, and of the wet pieces of faces
NORMAL = 0  # outward, unit (3)
CENTROID = 3  # (3)
RISE = 6  # vertical speed of the surface there, pieces only
PIECE = 7

STATE = 18  # centre of mass (3), rotation body to world row by row (9), velocity (3), angular velocity (3); world
WRENCH = 12  # water force, water torque, air force, air torque
IMMERSION = 5  # area, its centroid, height of the lowest point

# a patch of moving surface
PATCH_X = 0  # of its first point
PATCH_Y = 1
PATCH_RATE = 2  # points per metre
PATCH_NX = 3
PATCH_NY = 4
PATCH_HIGHEST = 5  # greatest |elevation|
PATCH_POINTS = 6  # elevations, then vertical speeds, x first

# a motion: what the loops over faces share, body axes
HEIGHT = 0  # of the centre of mass
UP = 1
VELOCITY = 4  # of the centre of mass through the water under it
OMEGA = 7
RISING = 10  # vertical speed of the surface under the centre of mass
MOTION = 11
