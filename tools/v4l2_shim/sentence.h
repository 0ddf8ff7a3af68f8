/* Why something failed, in one sentence for the user. */
#ifndef TESSERA_V4L2_SHIM_SENTENCE_H
#define TESSERA_V4L2_SHIM_SENTENCE_H

#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>

/* Room for a path and what is wrong with it; what is longer is cut. */
enum { SENTENCE_BYTES = 4096 + 512 };

/* Writes the sentence. Always false, so that a failing check can end with it. */
__attribute__((format(printf, 2, 3))) static inline bool sentence_say(char to[SENTENCE_BYTES],
                                                                      const char *format, ...)
{
    va_list rest;
    va_start(rest, format);
    (void)vsnprintf(to, SENTENCE_BYTES, format, rest);
    va_end(rest);
    /* Names from outside may hold line breaks, and one failure is one line. */
    for (char *c = to; *c != '\0'; c++) {
        if ((unsigned char)*c < ' ') {
            *c = '?';
        }
    }
    return false;
}

#endif
