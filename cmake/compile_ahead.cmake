# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

# Compiles the dynamics at the end of the installation, so that no node waits for that: half a minute, kept in the user's
# cache. Off with -DDIAG_DYNAMICS_COMPILE=OFF. Never where a package is made, for there the cache is nobody's: makers of
# Debian and RPM packages set DESTDIR, conda-build sets CONDA_BUILD, and the HOME of Nix and sbuild is not there. Nor for
# another machine. A failure is a warning: nodes compile by themselves.
option(DIAG_DYNAMICS_COMPILE "Compile the dynamics at the end of the installation" ON)
if(DIAG_DYNAMICS_COMPILE AND NOT CMAKE_CROSSCOMPILING)
  install(CODE "
    if(\"\$ENV{DESTDIR}\$ENV{CONDA_BUILD}\" STREQUAL \"\" AND IS_DIRECTORY \"\$ENV{HOME}\")
      set(python_path \"\${CMAKE_INSTALL_PREFIX}/${PYTHON_INSTALL_DIR}\")  # where it is installed to, whatever was configured
      if(NOT \"\$ENV{PYTHONPATH}\" STREQUAL \"\")
        string(APPEND python_path \":\$ENV{PYTHONPATH}\")
      endif()
      message(STATUS \"Compiling the dynamics, for about half a minute; -DDIAG_DYNAMICS_COMPILE=OFF leaves it to the nodes\")
      execute_process(
        COMMAND \"${CMAKE_COMMAND}\" -E env \"PYTHONPATH=\${python_path}\"
          \"${Python3_EXECUTABLE}\" -m diag_dynamics compile --if-needed
        WORKING_DIRECTORY \"\${CMAKE_INSTALL_PREFIX}\"  # Python looks here first, and finds none of ours
        RESULT_VARIABLE status)
      if(NOT status EQUAL 0)
        message(WARNING \"The dynamics could not be compiled ahead; the first start of a node will take half a minute.\")
      endif()
    endif()")
endif()
