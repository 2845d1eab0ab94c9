"""What the importer has left to be written, written: how a path is made shorter."""

from __future__ import annotations

import copy
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status


class TruncatePath(Behaviour):
    """Leave off the end of a path: here its frame says so, and the poses stay."""

    inputs: Any
    outputs: Any

    def update(self) -> Status:
        shorter = copy.deepcopy(self.inputs.input_path)
        shorter.header.frame_id += f" less {self.inputs.distance} m"
        self.outputs.output_path = shorter
        return Status.SUCCESS
