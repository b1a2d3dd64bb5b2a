"""Tools that know nothing of imaging: errors, progress, commands, safe files, compiled loops.

command_line    How commands behave: one sentence for bad input, and what Ctrl-C does.
compiled_loops  How loops are compiled: with Numba, which needs no system library.
errors          The one exception that means: what you gave us cannot be used, and here is why.
plain_text      Names that others chose, shown as text: nothing in them is carried out, and nothing is
                hidden.
progress        Progress of long work: bars with time left on a terminal, plain lines in a log,
                "compiling" where it is.
safe_files      Writing that survives a kill: whatever has its final name is whole.
short_form      What values with large contents say of themselves: one line, and in notebooks a small
                table.
"""
