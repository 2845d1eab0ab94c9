# For building on ROS 2 wheels from the Python package index; a real ROS 2 installation needs none of this.
# Given to cmake with -DCMAKE_PROJECT_INCLUDE=<this file>, so that CMakeLists.txt stays a standard one.
#
# The Python targets that the wheels export carry include directories of the machine that built the
# wheels (/opt/python/...), and CMake refuses to use a target whose include directory does not exist.
# No longer needed when the wheels' <pkg>__rosidl_generator_pyExport.cmake name no such directory.
#
# What is built here must not export such directories either: this machine's Python is left out.
function(_repair_targets directory)
  get_property(_imported DIRECTORY "${directory}" PROPERTY IMPORTED_TARGETS)
  get_property(_own DIRECTORY "${directory}" PROPERTY BUILDSYSTEM_TARGETS)
  foreach(_target IN LISTS _imported _own)
    get_target_property(_directories ${_target} INTERFACE_INCLUDE_DIRECTORIES)
    set(_repaired "")
    foreach(_directory IN LISTS _directories)
      if(_directory MATCHES "^\\$<")
        list(APPEND _repaired "${_directory}")
      elseif(_target IN_LIST _own)
        list(APPEND _repaired "$<BUILD_INTERFACE:${_directory}>")
      elseif(IS_DIRECTORY "${_directory}")
        list(APPEND _repaired "${_directory}")
      endif()
    endforeach()
    if(_directories)
      set_target_properties(${_target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${_repaired}")
    endif()
  endforeach()
  get_property(_below DIRECTORY "${directory}" PROPERTY SUBDIRECTORIES)
  foreach(_each IN LISTS _below)
    _repair_targets("${_each}")
  endforeach()
endfunction()

# At the end of the package's CMakeLists.txt, when every dependency has been found.
cmake_language(DEFER DIRECTORY "${CMAKE_SOURCE_DIR}" CALL _repair_targets "${CMAKE_SOURCE_DIR}")
