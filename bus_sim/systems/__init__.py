"""The other systems in simulation: what each needs beside buses and controllers, in a package of its own."""
