"""Every frame that the machines of this system send beyond those of all, on both buses."""

from onboard.contract.packing import graph, graph_device

FRAMES = (*graph.FRAMES, *graph_device.FRAMES)
#: By what builds of different days are strangers.
WORDS = graph.WORDS
