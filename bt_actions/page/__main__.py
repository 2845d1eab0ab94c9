"""This user's page, served until ten minutes have passed without a browser: `run --view` starts it.

Prints the address, and writes nothing after it.
"""

import sys

from bt_actions.page import server, standing

IDLE = 600.0
"""Seconds after the last tab."""


def main() -> None:
    """Serve the page, unless another one of this user runs by now."""
    try:
        opened = server.listen()
        served, address = server.server_of(idle=IDLE), server.address_of(opened)
        with standing.registered(address):
            used = standing.running() or address
            print(used, flush=True)
            if used == address:
                served.run(sockets=[opened])
    except OSError as error:
        sys.exit(f"{error}")


if __name__ == "__main__":
    main()
