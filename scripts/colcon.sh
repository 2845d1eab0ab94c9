#!/bin/sh
# Builds all packages with colcon on the ROS wheels, then runs the demo, and draws it, from colcon's installation.
# usage: colcon.sh <folder holding venv/>
set -eu
folder=$(cd "$1" && pwd)
venv=$folder/venv

# The last two arguments of cmake are for wheels only; a real ROS workspace needs `colcon build` and no more.
AMENT_PREFIX_PATH=$venv CMAKE_PREFIX_PATH=$venv PATH=$venv/bin:$PATH \
    colcon --log-base "$folder/log" build --build-base "$folder/build" --install-base "$folder/install" \
    --cmake-args -DPython3_EXECUTABLE="$venv/bin/python" \
    -DCMAKE_PROJECT_INCLUDE="$PWD/bt_actions/packages/ros_wheels.cmake"

set +u
. "$folder/install/setup.sh"
cd "$folder" # away from the checkout, whose bt_actions/ would be imported otherwise
"$folder/install/bt_actions/lib/bt_actions/bt-actions" run \
    "$folder/install/bt_actions/share/bt_actions/trees/pick_and_place.yaml" --sim --speed 10
"$folder/install/bt_actions/lib/bt_actions/bt-actions" render pick_and_place -o "$folder/page.html"
