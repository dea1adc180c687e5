# Compiles the dynamics at the end of the installation, so that no node waits for that: half a minute, kept in the user's
# cache. Off with -DDIAG_DYNAMICS_COMPILE=OFF. Never where a package is made (DESTDIR is set, and the cache is nobody's),
# nor at an install from another place than a build for this machine. A failure is a warning: nodes compile by themselves.
option(DIAG_DYNAMICS_COMPILE "Compile the dynamics at the end of the installation" ON)
if(DIAG_DYNAMICS_COMPILE AND NOT CMAKE_CROSSCOMPILING)
  install(CODE "
    if(\"\$ENV{DESTDIR}\" STREQUAL \"\" AND IS_DIRECTORY \"\$ENV{HOME}\")
      set(python_path \"\${CMAKE_INSTALL_PREFIX}/${PYTHON_INSTALL_DIR}\")  # where it is installed to, whatever was configured
      if(NOT \"\$ENV{PYTHONPATH}\" STREQUAL \"\")
        string(APPEND python_path \":\$ENV{PYTHONPATH}\")
      endif()
      execute_process(
        COMMAND \"${CMAKE_COMMAND}\" -E env \"PYTHONPATH=\${python_path}\"
          \"${Python3_EXECUTABLE}\" -m diag_dynamics compile --quiet
        WORKING_DIRECTORY \"\${CMAKE_INSTALL_PREFIX}\"  # Python looks here first, and finds none of ours
        RESULT_VARIABLE status)
      if(NOT status EQUAL 0)
        message(WARNING \"The dynamics could not be compiled ahead; the first start of a node will take half a minute.\")
      endif()
    endif()")
endif()
