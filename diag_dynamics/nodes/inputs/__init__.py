"""What comes in, judged and assembled: joint states and odometry become whole states, or are refused by name."""
