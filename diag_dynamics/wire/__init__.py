"""Messages as the bytes that DDS carries and bags keep: laid out, and joint states of them taken in. No ROS."""
