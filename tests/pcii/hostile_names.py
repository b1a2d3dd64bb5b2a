"""Names by which a stranger might try to get more out of a page than text, a case of each kind."""

DO = "document.documentElement.setAttribute('data-ran','1')"
"""What every attempt would do, should it be carried out."""

NAMES = (
    f"<script>{DO}</script>",
    f'"><img src=x onerror="{DO}">',
    f"[go](javascript:{DO})",
    f"{{{{ ''.__class__ }}}}{{% if 1 %}}<svg onload={DO}>{{% endif %}}",
    f"&lt;script&gt;{DO}&lt;/script&gt; &amp;#60;",
    "a | b\n\n| d | e |\n|---|---|\n# f\n*stars* `ticks` $\\frac{1}{0}$",
    "\u202egnp.exe\u202c \u2066turned\u2069 \x00\x1b[31mred\x1b[0m\x7f\x85\u2028\r\n\t",
    "half a character \ud800 and a byte of a file's name \udcff",
    "日本語 עברית ελληνικά 👩\u200d🔬 e\u0301 " + "w" * 5000,
)
