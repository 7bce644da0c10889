"""Indices of an airframe row, (DIM,) float64, made by `Airframe.params_row`.

Names of three elements are slices NAME, NAME + 1, NAME + 2 for roll, pitch, yaw (body x, y, z).
"""

MASS = 0  # kg
INERTIA = 1  # 3, kg m^2
DRAG = 4  # 3, N/(m/s), along the body's axes
ANGULAR_DAMPING = 7  # Nm/(rad/s)
MOTOR_LAG = 8  # s
MOTOR_THRUST = 9  # N, one motor at command 1
ARM_X, ARM_Y = 10, 11  # m, motors stand at (+-ARM_X, +-ARM_Y)
YAW_TORQUE = 12  # m, reaction torque over thrust of a motor
MIXER_ROLL_PITCH, MIXER_YAW = 13, 14  # motor command per unit of torque set-point
HOVER_THRUST = 15  # 0..1, nominal, as the controller assumes it: domain randomisation does not change it
RATE_P, RATE_I, RATE_D, RATE_K, RATE_LIMIT_I = 16, 19, 22, 25, 28  # 3 each
GYRO_CUTOFF, DGYRO_CUTOFF, YAW_TORQUE_CUTOFF = 31, 32, 33  # Hz
MAGNET_Z = 34  # m, face of the magnet below the centre of mass (positive down)
FOOTPRINT_RADIUS = 35  # m, of the contact disc
DIM = 36
