"""What the fields of the mapd system's messages hold, and how they are filled and read."""

#: No task.
NO_TASK = 0xFFFF
#: Moves in one frame of a path, and bits of each.
MOVES_A_FRAME, MOVE_BITS = 12, 4
#: Most ways that lead from one cell: a move names one of them, 0 is a wait.
MOST_WAYS = (1 << MOVE_BITS) - 1
#: Most moves of a path, and the last step that can be told.
MOST_MOVES, LAST_STEP = 0xFFF, 0x3FFFFF
