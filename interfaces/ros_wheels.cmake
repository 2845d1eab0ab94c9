# For building on ROS 2 wheels from the Python package index; a real ROS 2 installation needs none of this.
# Given to cmake with -DCMAKE_PROJECT_INCLUDE=<this file>, so that CMakeLists.txt stays a standard one.
#
# The Python targets that the wheels export carry include directories of the machine that built the
# wheels (/opt/python/...), and CMake refuses to use a target whose include directory does not exist.
# No longer needed when the wheels' <pkg>__rosidl_generator_pyExport.cmake name no such directory.
foreach(_package builtin_interfaces service_msgs unique_identifier_msgs action_msgs)
  find_package(${_package} REQUIRED)
  set(_target ${_package}::${_package}__rosidl_generator_py)
  if(TARGET ${_target})
    get_target_property(_directories ${_target} INTERFACE_INCLUDE_DIRECTORIES)
    set(_existing "")
    foreach(_directory IN LISTS _directories)
      if(_directory MATCHES "^\\$<" OR IS_DIRECTORY "${_directory}")
        list(APPEND _existing "${_directory}")
      endif()
    endforeach()
    set_target_properties(${_target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${_existing}")
  endif()
endforeach()
