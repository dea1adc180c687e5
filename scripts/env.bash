# shellcheck shell=bash disable=SC1090
# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

# source scripts/env.bash (bash or zsh): a shell in which diag_dynamics, its messages and ROS 2 can be imported from any
# directory. May be sourced again, after ROS_DISTRO was changed too.

dd_root=$(cd "$(dirname "${BASH_SOURCE[0]:-$0}")/.." && pwd -P)
. "$dd_root/scripts/choose_ros.bash"

if grep -qsF "$dd_home " "$dd_home/install/.complete"; then  # complete, and made here: it does not survive a move
  export VIRTUAL_ENV=$dd_home/venv
  export PATH=$VIRTUAL_ENV/bin:$PATH
  if [ $dd_ros = pypi ]; then
    export AMENT_PREFIX_PATH=$VIRTUAL_ENV ROS_DISTRO=${ROS_DISTRO:-jazzy} ROS_VERSION=2
  fi
  case $- in *u*) dd_strict=yes && set +u ;; esac  # colcon's script reads variables that nobody has set
  # colcon's own script: our typesupport libraries are found by LD_LIBRARY_PATH only, set before Python starts
  . "$dd_home/install/local_setup.${ZSH_VERSION:+z}${BASH_VERSION:+ba}sh"
  [ -z "${dd_strict-}" ] || set -u
  export LD_LIBRARY_PATH=${LD_LIBRARY_PATH%:}  # it leaves an empty entry, which would mean the current directory
  hash -r
  dd_status=0
else
  echo "Nothing built here for ${dd_home##*/} yet." \
    "Run: ${ROS_DISTRO:+ROS_DISTRO=$ROS_DISTRO }make -C '$dd_root' setup" >&2
  dd_status=1
fi

unset -f dd_plain
unset dd_strict dd_root dd_ros dd_built dd_home dd_python dd_numpy dd_name dd_value
# "return" with a value that outlives the unset
eval "unset dd_status; return $dd_status"
