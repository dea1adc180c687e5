"""Alarms on external torque: thresholds, the detector that judges by them, and how often it is wrong."""
