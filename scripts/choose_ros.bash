# shellcheck shell=bash disable=SC2034,SC2154  # variables come from and go to the script that sources this
# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

# Sourced by setup and env.bash (bash or zsh): forgets what an earlier env.bash put into the environment, then chooses
# the ROS 2 to use. Expects dd_root, the checkout; sets
#   dd_ros     sourced, if the environment holds a working ROS 2, else pypi
#   dd_built   the folder of all that is made: build/, or $DIAG_DYNAMICS_BUILD, or for a checkout whose path CMake's
#              macros of ROS 2 would break at a blank or a letter, one in the user's cache
#   dd_home    the folder in there that everything made for this ROS 2 goes to
#   dd_python  sourced only: the Python that ROS 2 works with
#   dd_numpy   sourced only: the version of that Python's NumPy

dd_plain() { ! printf %s "$1" | LC_ALL=C grep -q '[^A-Za-z0-9/._+~@-]'; }
dd_built=${DIAG_DYNAMICS_BUILD:-$dd_root/build}
if [ -z "${DIAG_DYNAMICS_BUILD:-}" ] && ! dd_plain "$dd_root"; then
  dd_built=${XDG_CACHE_HOME:-$HOME/.cache}/diag_dynamics_builds/$(printf %s "$dd_root" | cksum | tr ' ' -)
fi

for dd_name in PATH LD_LIBRARY_PATH PYTHONPATH AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH PKG_CONFIG_PATH
do
  eval "dd_value=\${$dd_name:-}"
  case "$dd_value" in
    *"$dd_built/"*)
      dd_value=$(printf %s "$dd_value" | tr : '\n' | { grep -vF "$dd_built/" || :; } | paste -sd: -)
      if [ -n "$dd_value" ]; then export "$dd_name=$dd_value"; else unset "$dd_name"; fi ;;
  esac
done
case "${VIRTUAL_ENV:-}" in "$dd_built/"*) unset VIRTUAL_ENV ;; esac
# The wheels re-execute Python once with LD_LIBRARY_PATH set and tell the children not to. This mark, inherited from
# another environment's Python, would leave ours without its libraries.
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE

dd_ros=pypi
if [ -n "${AMENT_PREFIX_PATH:-}" ]; then
  for dd_python in python3 /usr/bin/python3; do  # the second: python3 may be one that this ROS 2 was not built for
    if dd_numpy=$("$dd_python" -c 'import numpy, rclpy; print(numpy.__version__)' 2>/dev/null); then
      dd_ros=sourced
      break
    fi
  done
  if [ $dd_ros = pypi ]; then
    echo "A ROS 2 is sourced, but python3 cannot import its rclpy: using the ROS 2 from PyPI instead." >&2
    unset AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH
  fi
fi
if [ $dd_ros = pypi ]; then
  dd_home=$dd_built/${ROS_DISTRO:-jazzy}
else
  dd_home=$dd_built/${ROS_DISTRO:+$ROS_DISTRO-}sourced
fi
