"""What the force kernels know of a body: a block of doubles, body axes about the centre of mass.

A header (the places below), then columns of faces, then what is known of every group of faces, then the plane
faces if the law needs them (`_strip_kernels`). Number c of face i
stands at HEADER + c STRIDE + i: columns let a loop over faces run in vector registers. Faces of a group lie near
each other, so that many of a large body are passed over at once. The last columns are filled up to a multiple
of WIDTH with points without area.
"""

N_FACES = 0
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
FORWARD = 20  # 1: the load of a plane face acts ahead of the middle of its wet strips, by Rayleigh
STRIDE = 21  # faces in a column, filled up to a multiple of WIDTH
VOLUME = 22  # inside the closed mesh [m^3]
VOLUME_CENTRE = 23  # its centroid (3)
CAVITY = 26
QUADRATURE = 27  # 1: loads are integrated over each triangle, 0: taken at its centroid
N_PLANES = 28  # plane faces, if the law needs them
PLANES = 29  # where they begin in the block
MAX_EDGES = 30  # of one of them
ADDED_MASS = 31  # rho times the share of the water that moves with wet plates
GRAVITY = 32  # [m/s^2], for that alone, as what follows
INVERSE_MASS = 33
INERTIA = 34  # (9)
INVERSE_INERTIA = 43  # (9)
MIDDLE = 52  # of a box about the body (3), along its axes
HALF = 55  # half its sides (3)
HEADER = 64

CORNERS = 0  # a, b, c (9)
AREA = 9
FACES = 10  # from here on as for pieces of faces
PLANE = 19  # where the face's plane begins in the block, or 0
COLUMNS = 20

# columns of faces, and of the wet pieces of faces
NORMAL = 0  # outward, unit (3)
CENTROID = 3  # (3)
ARM = 6  # centroid x normal (3), faces only
RISE = 6  # vertical speed of the surface there, pieces only
PIECE = 7

WIDTH = 8  # doubles of the widest vector register
GROUP = 32  # faces, a multiple of WIDTH

# of a group of faces
BOX = 0  # middle (3) and half the sides (3) of a box about them
LIFT = 6  # force (3) and torque (3) per rho g quite under water, each by height (1) and upward vertical (3)
ABOUT_GROUP = 30

# a plane face: normal (3), distance, number of edges, then the edges' ends
EDGES = 4
OUTLINE = 5
EDGE = 6

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
