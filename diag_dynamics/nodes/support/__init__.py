"""What nodes share: their life, their parameters, their diagnostics, their robot."""
