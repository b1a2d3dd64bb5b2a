"""Tools that know nothing of cameras: errors, progress, commands, compiled loops, sRGB.

command_line      Running of command lines: help, error messages of one sentence, exit codes, --quiet, and
                  Ctrl-C.
command_output    What a command prints: what it did, what was asked for, and the next command to type.
compiled_loops    Compilation of loops with Numba, which needs no system library.
dask_cluster      A job's pieces as tasks of a Dask cluster, all of whose workers see the same file
                  system.
errors            The exception that is raised for invalid input.
executor          Who does a job: this process, several of this machine, or a Dask cluster.
extensions        Methods by name: built-in ones and entry points of installed packages; calls of
                  functions of theirs.
jobs              Jobs of many pieces.
plain_text        Display of text from untrusted files: markup is escaped, invisible characters are made
                  visible.
progress          Progress of long work, compilation included: bars on a terminal, plain lines in a log.
safe_files        Atomic writing of files and folders: whatever has its final name is complete.
short_form        Short representations of objects that hold large arrays, in one line.
srgb              sRGB (IEC 61966-2-1): encoding for screens, decoding of pictures to linear values,
                  luminance.
worker_processes  Worker processes of this machine that share a job's pieces; one that dies harms no other
                  piece.
"""
