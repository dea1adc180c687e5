"""The ROS-free library; colcon builds the ROS package by CMakeLists.txt and never runs this file."""

from setuptools import setup

setup()  # pyproject.toml says the rest
