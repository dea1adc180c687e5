"""Demonstrations without a ROS: a wrong model, a simulated robot that it is of, and what the library makes of both."""
