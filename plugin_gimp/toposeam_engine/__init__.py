"""The engine: numerics for programs that cannot load them; the other end of the GIMP plug-in's protocol. No
click in here.
"""
