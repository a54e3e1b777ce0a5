"""The studio: a local page that searches the code of a picture while one looks on, and lets hands correct it.

`reading` is the picture and how it was read, `tasks` what the process of `worker` does, `standing` what is known of
picture and code, `session` what becomes of them, `messages` what a page may ask, `keeping` the folder that outlives the
session, `saving` the files, `server` the page and its WebSocket, `serving` the process that offers them.
"""
