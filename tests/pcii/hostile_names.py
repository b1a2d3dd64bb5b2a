"""Names by which a stranger might try to get more out of a page than text."""

RAN = "data-ran"
"""Attribute of the page's root that every attempt sets, should it be carried out."""
DO = f"document.documentElement.setAttribute('{RAN}','1')"
DO_QUOTED = DO.replace("'", '"')
SENT = f"<svg onload={DO}>"

NAMES = (
    f"<script>{DO}</script>",
    f"<scr<script>ipt>{DO}</scr</script>ipt>",
    f"<img src=x onerror={DO}>",
    f'"><img src=x onerror="{DO}">',
    f'" onerror="{DO}" x="',
    f"' onload='{DO_QUOTED}' x='",
    f'" autofocus onfocus="{DO}" tabindex="0',
    f"<svg><script>{DO}</script></svg>",
    f'<iframe src="javascript:parent.{DO}"></iframe>',
    f'<iframe srcdoc="<script>parent.{DO}</script>"></iframe>',
    f'<object data="javascript:{DO}"></object>',
    f'<a href="javascript:{DO}" id=go>go</a>',
    f"[go](javascript:{DO})",
    f'<meta http-equiv="refresh" content="0;url=javascript:{DO}">',
    '<base href="https://example.invalid/"><link rel=stylesheet href=x>',
    f"</style><script>{DO}</script><style>",
    f"</textarea></main></body></html><script>{DO}</script>",
    f"--><script>{DO}</script><!--",
    f"{{{{ ''.__class__ }}}}{{% if 1 %}}{SENT}{{% endif %}}",
    f"&lt;script&gt;{DO}&lt;/script&gt; &amp;#60;",
    "a | b || c\n\n| d | e |\n|---|---|\n# f\n<b>g</b>",
    "*stars* _lines_ `ticks` ~~struck~~ $\\frac{1}{0}$ \\| \\",
    "\u202egnp.exe\u202c \u2066\u2067turned\u2069 \u200fright",
    "\x00\x01\x07\x08\x1b[31mred\x1b[0m\x7f\x85\u2028\u2029\r\n\t",
    "half a character \ud800 and a byte of a file's name \udcff",
    "日本語 עברית ελληνικά 👩‍🔬 e\u0301 " + SENT,
    "long " + "w" * 5000 + SENT,
)
