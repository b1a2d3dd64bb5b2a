"""Tools that know nothing of cameras: errors, progress, commands, compiled loops, sRGB.

command_line      Command lines: help, what they print, errors of one sentence, exit codes.
compiled_loops    Compilation of loops with Numba, and the threads that share them.
errors            Exceptions whose sentence is all that a command prints of them.
executor          Where the pieces of work are done: in this process, in local worker processes, or on a
                  Dask cluster.
extensions        Functions of others: entry points of installed packages, module:function, file.py:function.
plain_text        Display of text from untrusted files: markup is escaped, invisible characters are made
                  visible.
progress          Progress of long work: bars on a terminal, plain lines in a log.
safe_files        Atomic writing of files and folders: whatever has its final name is complete.
short_form        Short representations of objects that hold large arrays, in one line.
srgb              sRGB (IEC 61966-2-1): encoding for screens, decoding of pictures to linear values,
                  luminance.
"""
