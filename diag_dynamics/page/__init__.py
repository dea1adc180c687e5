"""The page: a robot as a scene, its states as frames of numbers, and the server that streams them. No ROS."""
