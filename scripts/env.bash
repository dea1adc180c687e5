# shellcheck shell=bash disable=SC1090
# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

# source scripts/env.bash (bash or zsh): a shell in which diag_dynamics, its messages and ROS 2 can be imported from any
# directory. May be sourced again, after ROS_DISTRO was changed too.

dd_root=$(cd "$(dirname "${BASH_SOURCE[0]:-$0}")/.." && pwd -P)
. "$dd_root/scripts/choose_ros.bash"

if [ "$(cut -d' ' -f1 "$dd_home/install/.complete" 2>/dev/null)" = "$dd_home" ]; then  # complete, and made here: it does not survive a move
  export VIRTUAL_ENV=$dd_home/venv
  export PATH=$VIRTUAL_ENV/bin:$PATH
  if [ $dd_ros = pypi ]; then
    export AMENT_PREFIX_PATH=$VIRTUAL_ENV ROS_DISTRO=${ROS_DISTRO:-jazzy} ROS_VERSION=2
  fi
  # the typesupport libraries are found by LD_LIBRARY_PATH alone, which counts when Python starts
  dd_python=$(find "$dd_home/install" -path '*-packages/diag_dynamics' -prune -print -quit)
  export PATH=$dd_home/install/bin:$PATH AMENT_PREFIX_PATH=$dd_home/install:$AMENT_PREFIX_PATH
  export LD_LIBRARY_PATH=$dd_home/install/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
  export PYTHONPATH=${dd_python%/*}${PYTHONPATH:+:$PYTHONPATH}
  hash -r
  dd_status=0
else
  echo "Nothing built here for ${dd_home##*/} yet." \
    "Run: ${ROS_DISTRO:+ROS_DISTRO=$ROS_DISTRO }make -C '$dd_root' setup" >&2
  dd_status=1
fi

unset -f dd_plain
unset dd_root dd_ros dd_built dd_home dd_python dd_numpy dd_name dd_value
# "return" with a value that outlives the unset
eval "unset dd_status; return $dd_status"
