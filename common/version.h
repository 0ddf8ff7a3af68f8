/* The version of all programs. The wire format and the file formats have numbers of their own. */
#ifndef TESSERA_COMMON_VERSION_H
#define TESSERA_COMMON_VERSION_H

#define TESSERA_VERSION "0.1.0"

#endif
