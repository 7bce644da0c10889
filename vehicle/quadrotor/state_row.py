"""Indices of a vehicle's state row, (DIM,) float64: body, motors and rate loop. World ENU, body FLU."""

P = 0  # 3, position of the centre of mass, m, world
V = 3  # 3, velocity, m/s, world
Q = 6  # 4, world from body, w x y z
W = 10  # 3, body rate, rad/s
MOTOR = 13  # 4, thrust of a motor over its full thrust, 0..1
WIND = 17  # 3, velocity of the air, m/s, world: an input that stays until changed
F = 20  # 3, specific force (the accelerometer's reading) over the last substep, m/s^2, body
COMMAND = 23  # 4, motor commands of the last substep, 0..1
GYRO = 27  # 6, second-order low-pass of the body rate: two delay elements per axis
RATE = 33  # 3, filtered body rate of the last substep, rad/s
ACCEL = 36  # 3, filtered angular acceleration, rad/s^2
INTEGRAL = 39  # 3, integrator of the rate loop, torque set-point
TORQUE_YAW = 42  # filtered yaw torque set-point
HEADROOM_UP, HEADROOM_DOWN = 43, 46  # 3 each, 0 where the last allocation could not give more of that torque, else 1
DIM = 49
