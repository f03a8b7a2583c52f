/* Page files as bytes. Paths are relative to the checkout's root, from where make runs. */
    .section .rodata

    .macro asset name, file
    .global asset_\name
    .global asset_\name\()_end
    .balign 16
asset_\name:
    .incbin "\file"
asset_\name\()_end:
    .byte 0
    .endm

    asset index_html, "host/view/page/index.html"
    asset style_css, "host/view/page/style.css"
    asset instrument_js, "host/view/page/instrument.js"
    asset stage_js, "host/view/page/stage.js"
    asset trace_js, "host/view/page/trace.js"
    asset view_js, "host/view/page/view.js"
    asset icon_svg, "host/view/page/icon.svg"
    asset three_js, "/usr/share/javascript/three/three.min.js"
    asset orbit_js, "/usr/share/javascript/three/examples/js/controls/OrbitControls.js"

    .section .note.GNU-stack, "", %progbits
