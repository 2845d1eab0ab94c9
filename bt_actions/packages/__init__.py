"""Interface packages (action/, msg/, srv/), from sources to wheels without a ROS installation.

Five steps, a file each, which only hand values on:

    sources.py      a package as it stands, read and checked: nothing is compiled that cannot work
    order.py        which packages are built, and on what each stands
    environment.py  the build environment: made once from pinned wheels, then kept
    generation.py   rosidl by CMake, into a prefix of the package's own
    wheel.py        a prefix becomes a wheel, for running and for building upon it

`building.py` takes them in this order, `installing.py` installs all wheels at once or none.

Prefixes are a list: the build environment has the generators, this environment the messages of
ROS, and each package that was built before has its own. CMake looks through them in this order.

The package's CMakeLists.txt says which files are generated, and is not run: an interface package
as large as nav2_msgs calls macros of a package that is no wheel, and needs none of them for what
rosidl makes. The types that its files use tell what a package stands on.

All but `installing.py` runs in pip's build isolation, too, where nothing is installed but the
pinned list: interfaces/backend.py builds our own packages so.
"""


class PackageError(Exception):
    """A package cannot be built or installed; the text says which, why, and what to do."""
