# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

# What ROS 2 from PyPI needs beyond a stock ROS; a no-op elsewhere. Include after rosidl_generate_interfaces().
#
# A *__rosidl_generator_py target exports the absolute paths of the Python and NumPy headers it was built with.

# Those of the wheels are of the machine that built the wheels, and CMake refuses directories that do not exist.
get_property(_targets DIRECTORY PROPERTY IMPORTED_TARGETS)
list(FILTER _targets INCLUDE REGEX "__rosidl_generator_py$")
foreach(_target IN LISTS _targets)
  get_target_property(_includes ${_target} INTERFACE_INCLUDE_DIRECTORIES)
  if(_includes)
    list(FILTER _includes EXCLUDE REGEX "^/opt/python/")
    set_target_properties(${_target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${_includes}")
  endif()
endforeach()

# Ours are in a virtual environment below this directory, and CMake refuses to export paths into the source tree. A stock
# rosidl_generator_py sets no such property, and writing what was not found would make CMake fail.
set(_target ${PROJECT_NAME}__rosidl_generator_py)
get_target_property(_includes ${_target} INTERFACE_INCLUDE_DIRECTORIES)
if(_includes)
  list(TRANSFORM _includes REPLACE "^/.*/site-packages/.*" "$<BUILD_INTERFACE:\\0>")
  set_target_properties(${_target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${_includes}")
endif()

# `scripts/setup` compiles the sources of a library as one, because their headers take most of the time. Those of these
# libraries have equal names.
foreach(_kind rosidl_generator_c rosidl_generator_py rosidl_typesupport_introspection_c rosidl_typesupport_introspection_cpp)
  if(TARGET ${PROJECT_NAME}__${_kind})
    set_target_properties(${PROJECT_NAME}__${_kind} PROPERTIES UNITY_BUILD OFF)
  endif()
endforeach()
