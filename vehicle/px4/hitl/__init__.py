"""Our simulated vehicle as the world of a real PX4 firmware: sensors into its simulator interface, motors out of it."""
