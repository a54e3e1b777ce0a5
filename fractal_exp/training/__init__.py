"""How the networks of compared methods are trained: one loop (`loop`), the codes and pictures that networks learn from
(`codes`, `drawing`), and a file for each network. A fit needs none of it, but the weights that come out.
"""
