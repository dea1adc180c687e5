"""The terminal view `top`: a robot's joints by what they do, with peaks, limits, sparklines and a chart."""
