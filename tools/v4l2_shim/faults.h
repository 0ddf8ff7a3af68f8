/* A script of what goes wrong with a device: which frame, which fault. */
#ifndef TESSERA_V4L2_SHIM_FAULTS_H
#define TESSERA_V4L2_SHIM_FAULTS_H

#include <stdint.h>

#include "tools/v4l2_shim/sentence.h"

enum { FAULTS_MAX = 1024 };

enum fault {
    FAULT_NONE,
    FAULT_ERROR,  /* the frame comes marked V4L2_BUF_FLAG_ERROR           */
    FAULT_SHORT,  /* only half of its bytes come                          */
    FAULT_LOST,   /* it does not come; the sequence number goes on        */
    FAULT_UNPLUG, /* the device goes away once what came before is taken  */
};

struct faults {
    struct {
        uint64_t   frame; /* counted from 0 at each STREAMON */
        enum fault fault;
    } at[FAULTS_MAX];
    uint32_t count;
};

/* Header line `frame,fault`, then a row a fault: error, short, lost or unplug. */
bool faults_read(const char *path, struct faults *out, char sentence[SENTENCE_BYTES]);

enum fault faults_of(const struct faults *faults, uint64_t frame);

#endif
