"""The factory graph of Gnatowski (2010): robots ask node agents, who grant edges."""
