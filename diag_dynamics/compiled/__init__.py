"""How the physics is compiled and kept: the only room that knows numba's inside."""
