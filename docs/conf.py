"""The documentation site: pages by hand, pages from the declarations in the code, and a gallery of executed examples.

`sphinx-build -W docs docs/_build` executes all examples; with `-D plot_gallery=0` it builds the pages alone.
"""

import sys
from pathlib import Path

from airflock import __version__

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))

project, author, release = "Airflock", "The Airflock authors", __version__
copyright = author
extensions = [
    "myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_gallery.gen_gallery",
    "docstrings", "mathml", "pages", "terms",
]  # fmt: skip
exclude_patterns = ["_build", "_ext", "evolve.md", "decisions", "gallery", "notebooks", "tours"]
exclude_patterns += ["generated/**/*.ipynb", "**/*.codeobj.json"]
suppress_warnings = ["config.cache"]  # the gallery's order is a function, which is no text to compare builds by
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 4
nitpicky = False
default_role = "code"  # of single backticks in the texts of examples
smartquotes = False  # options begin with two hyphens, and values are to be copied
html_theme = "pydata_sphinx_theme"
html_title = f"Airflock {release}"
html_static_path = ["_static"]
html_css_files = ["airflock.css"]
html_math_renderer = "mathml"  # equations as MathML: no script, no network
html_theme_options = {
    "show_prev_next": False,
    "secondary_sidebar_items": ["page-toc"],
    "navbar_align": "left",
    "header_links_before_dropdown": 9,
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "tango",
}
html_sidebars = {"index": [], "start": []}
html_copy_source = False
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False


sphinx_gallery_conf = {
    "examples_dirs": ["gallery", "tours", "notebooks"],
    "gallery_dirs": ["generated/gallery", "generated/tours", "generated/notebooks"],
    "filename_pattern": r"/\d\d_",
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_memory": False,
    "abort_on_example_error": True,
    "within_subsection_order": "FileNameSortKey",
    "matplotlib_animations": False,
    "default_thumb_file": str(HERE / "images" / "4ms.png"),
    "min_reported_time": 1e9,
    "show_signature": False,
    "write_computation_times": False,
    "image_scrapers": ("figures",),
    "reset_modules": (),
    "ignore_repr_types": r"matplotlib\.|airflock\.plots|'list'",  # what axes return is no output of an example
}
