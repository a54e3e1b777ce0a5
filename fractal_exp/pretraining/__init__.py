"""How networks of compared methods are trained: pictures of random codes, drawn on the fly (`pictures`), the loop
(`loop`), and a file for each network. A fit needs none of it, but the weights that come out.
"""
