"""The two papers behind canid: what follows from their numbers, their method on any log, and canid's answer next to it.

A package on top of canid: it may import all of canid, and nothing of canid imports it but the verb `canid study`.
"""
