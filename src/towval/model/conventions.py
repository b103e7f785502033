"""Units, frames, axes and symbols: the one place.

Units
    SI and radians everywhere. Anything else carries its unit in the name (``_px``, ``_deg``, ``_mm``).

Frames
    floor
        Right-handed, origin and x axis as ``campaign.yaml`` draws them, z up. The floor is z = 0.
    body (rover, object)
        The frame in which ``top_corners_m`` is given. Its pose ``(x, y, heading)`` is that frame's, projected
        vertically to the floor.
    camera
        OpenCV's: x to the right of the image, y down, z along the optical axis.
    pixel
        ``(u, v)``, column and row; (0, 0) is the centre of the top-left pixel.

``T_AB`` maps coordinates in B to coordinates in A: ``p_A = T_AB p_B``. Headings are counter-clockwise seen from
above, and unwrapped along a track.

Time is float seconds in memory and integer nanoseconds in MCAP, both the video's own presentation times.

Symbols of the paper (SOURCE: *Towing an Object With a Rover*) and their names here

=========  ==============================  =======
symbol     name                            unit
=========  ==============================  =======
p          pressure                        Pa
N          normal_force                    N
(a, b, c)  pressure plane coefficients     Pa/m, Pa/m, Pa
mu         friction coefficient            1
gamma      coefficients of Makkar's law    1, s/m
v_s        stiction_velocity               m/s
v_k        friction_velocity               m/s
F_k, M_k   friction wrench                 N, N m
Q_T        anchor (tether on the object)   m
P_r        hinge (tether on the rover)     m
kappa      stiffness                       N/m
l_0        rest_length                     m
T          tether_force                    N
omega      heading rate                    rad/s
=========  ==============================  =======
"""

GRAVITY_M_PER_S2 = 9.81
"""Standard gravity as the paper rounds it [m/s²]."""

NANOSECONDS_PER_SECOND = 1_000_000_000

STAGES_OF_RUN = ("track", "decimate", "simulate", "uncertainty", "compare")
"""Stages of a run in their order; each leaves a file of its name."""

FLOOR_FRAME = "floor"
CAMERA_FRAME = "camera"

VIEW_MOTION = ("rx", "ry", "rz", "tx", "ty", "tz", "zoom", "cx", "cy")
"""Turn about the camera's axes [rad], shift along them [m], logarithm of the focal length's factor, and shift of the
principal point [px], which is that of a picture moved by its stabiliser."""

PICTURE_MOTION = ("u", "v", "turn", "growth")
"""What a motion of the view does to the picture of the floor: shift of its middle [px], turn, clockwise as seen [rad],
and logarithm of its growth."""

FEWEST_FRAMES = 8
"""Of a body in a run: of fewer poses nothing tells the noise."""
