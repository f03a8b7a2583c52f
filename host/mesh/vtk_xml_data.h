/* The numbers of one DataArray of a VTK XML file: text, base64 in place, or a stretch of the appended data (raw or base64),
 * each optionally in zlib blocks. https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html#xml-file-formats */
#ifndef TROCAR_VTK_XML_DATA_H
#define TROCAR_VTK_XML_DATA_H

#include "vtk_values.h"

struct xml_encoding {
    bool swap;        /* the file's byte order is not this machine's */
    bool wide_header; /* UInt64 instead of UInt32 */
    bool zlib;
};

struct xml_array {
    enum vtk_type type;
    char name[80];
    size_t components;
    enum { XML_TEXT, XML_BASE64, XML_RAW } form;
    size_t at, end; /* the bytes of the file that hold it (appended: to the end of the file) */
    long line;      /* where its element stands */
};

/* All numbers of the array. `expected` is their number, or SIZE_MAX if only the array knows it. malloc. */
int xml_numbers(struct scan *s, const struct xml_array *array, const struct xml_encoding *encoding, size_t expected,
                bool finite, double **values, size_t *count);

#endif
