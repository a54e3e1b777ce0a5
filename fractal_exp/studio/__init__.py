"""The studio: a local page that searches the code of a picture while one looks on, and lets hands correct it.

`reading` is the picture and how it was read, `tasks` what the process of `worker` does, `session` where all stands,
`saving` the files, `server` the page and its WebSocket, `serving` the process that offers them.
"""
