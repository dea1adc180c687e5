"""What makes a simulated robot look like a real one to the graph: its drives, its sensors, its pace, who pushes it."""
