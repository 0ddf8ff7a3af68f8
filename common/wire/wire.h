/* The one encoder and decoder of feature packets. WIRE.md says what every byte means.
 *
 * Both halves use it: the camera writes a packet with wire_begin, wire_put_patch and wire_finish;
 * the host checks one with wire_decode and then walks it with wire_next_patch and
 * wire_next_feature, which cannot fail. All memory is the caller's. Positions: (0,0) is the
 * centre of the top-left pixel. */
#ifndef TESSERA_COMMON_WIRE_WIRE_H
#define TESSERA_COMMON_WIRE_WIRE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define WIRE_VERSION 1
#define WIRE_PREFIX_BYTES 16u        /* what wire_packet_bytes needs; the same in every version */
#define WIRE_HEADER_BYTES 144u       /* what this encoder writes */
#define WIRE_HEADER_BYTES_MAX 512u   /* what a later encoder of this version may write */
#define WIRE_SERIAL_BYTES 32u
#define WIRE_IDS 4096u               /* patch ids are below this; so are patches a packet */
#define WIRE_FEATURES 85u            /* feature indices of a patch are below this */
#define WIRE_FEATURES_LEVEL_2 13u
#define WIRE_SIDE_PX_MAX 32768u      /* width and height of an image */
#define WIRE_FEATURE_BYTES 7u
#define WIRE_PATCH_BYTES_MAX 608u    /* 4 + 9 + 85 x 7 */
/* What a frame of level 2 needs at most: 4096 patches of 13 features. */
#define WIRE_PACKET_BYTES_LEVEL_2 (WIRE_HEADER_BYTES + WIRE_IDS * 95u)
/* No packet is longer; a receiver refuses before it waits for more. */
#define WIRE_PACKET_BYTES_MAX (WIRE_HEADER_BYTES_MAX + WIRE_IDS * WIRE_PATCH_BYTES_MAX)
#define WIRE_CLOCK_UNCERTAINTY_UNKNOWN 0xffffffffu

enum wire_status {
    WIRE_OK = 0,
    WIRE_SHORT,           /* fewer bytes than the packet says, or than a header has */
    WIRE_BAD_MAGIC,
    WIRE_BAD_VERSION,
    WIRE_BAD_LENGTH,      /* a stated length outside its limits, or not that of the bytes in hand */
    WIRE_BAD_CHECKSUM,
    WIRE_RESERVED_SET,    /* a bit of the kind that must be refused */
    WIRE_BAD_SERIAL,
    WIRE_BAD_CLOCK,
    WIRE_BAD_IMAGE,       /* width, height, fraction bits */
    WIRE_BAD_SENSOR,      /* region, binning */
    WIRE_BAD_ORDER,       /* patches or features not strictly ascending, or an index that is none */
    WIRE_EMPTY_PATCH,
    WIRE_OUTSIDE_IMAGE,
    WIRE_BAD_COUNT,       /* patches or features are not as many as stated */
    WIRE_FULL,            /* encoder only: no room, the packet now says so */
    WIRE_STATUS_COUNT
};

enum wire_clock {
    WIRE_CLOCK_UNKNOWN = 0,
    WIRE_CLOCK_MONOTONIC = 1,
    WIRE_CLOCK_REALTIME = 2,
    WIRE_CLOCK_TAI = 3,
    WIRE_CLOCK_FILE = 4,   /* times come from a recording */
    WIRE_CLOCK_COUNT
};

/* wire_header.truncated: which list of the camera was full. Bits that are not named may be set
 * too. */
enum {
    WIRE_TRUNCATED_EDGES = 1 << 0,
    WIRE_TRUNCATED_CHAINS = 1 << 1,
    WIRE_TRUNCATED_ELLIPSES = 1 << 2,
    WIRE_TRUNCATED_MARKS = 1 << 3,
    WIRE_TRUNCATED_PATCHES = 1 << 4,
    WIRE_TRUNCATED_PACKET = 1 << 5   /* set by the encoder when a patch did not fit */
};

/* wire_header.flips */
enum { WIRE_FLIP_COLUMNS = 1, WIRE_FLIP_ROWS = 2 };

/* What a packet says about its frame. The last three are the encoder's: set by it, ignored from
 * callers. */
struct wire_header {
    char     camera_serial[WIRE_SERIAL_BYTES + 1]; /* UTF-8, 1..32 bytes and a zero; no controls */
    uint64_t boot_id;                /* another value after each start of the device; 0 unknown */
    uint32_t sequence;               /* the driver's frame number; gaps are lost frames; wraps */
    uint32_t packet_index;           /* packets built since start, from 0; gaps are lost; wraps */
    int64_t  t_capture_ns;           /* middle of the exposure of the image's first row */
    uint32_t clock_uncertainty_ns;   /* standard deviation of t_capture_ns, or ..._UNKNOWN */
    uint32_t exposure_ns;            /* 0 unknown */
    uint32_t row_time_ns;            /* from row to row, downwards; 0 global shutter */
    uint8_t  clock_kind;             /* enum wire_clock */
    uint8_t  flips;                  /* image against sensor; WIRE_FLIP_... */
    uint8_t  binning_x, binning_y;   /* sensor pixels to one image pixel; 0 unknown, else 1..16 */
    uint16_t width_px, height_px;    /* image, 1..32768 */
    uint16_t region_x, region_y;     /* the image's place on the sensor, sensor pixels ... */
    uint16_t region_width, region_height; /* ... before binning and flips; all four 0: unknown */
    uint32_t frames_dropped;         /* by capture, since start */
    uint32_t packets_dropped;        /* by the sender, since start */
    uint64_t target_digest;          /* names the target file in use; 0 none */
    uint64_t settings_digest;        /* names the detector's settings; 0 not stated */
    uint16_t truncated;              /* WIRE_TRUNCATED_... */
    uint16_t patch_count;            /* 0..4096 */
    uint32_t feature_count;
    uint8_t  fraction_bits;          /* of positions on the wire, 8..14 from this encoder */
};

/* One feature: the centre of the ellipse that a circle's edge makes in the image. */
struct wire_feature {
    int32_t  x_px_q16, y_px_q16;     /* [-0.5, width - 0.5), [-0.5, height - 0.5) */
    uint32_t sigma_px_q24;           /* standard deviation per axis; wire: 0.00049 to 0.63 px */
    uint32_t size_px_q16;            /* geometric mean of the semi-axes; on the wire 1 to 1290 px */
    uint8_t  index;                  /* in the patch, 0..84 */
};

/* A packet being written; its fields are the encoder's own. */
struct wire_writer {
    uint8_t *bytes;
    size_t   capacity, used;
    uint32_t feature_count;
    uint16_t patch_count, width_px, height_px, truncated;
    uint8_t  fraction_bits;
    bool     is_full;
    int32_t  last_patch_id;          /* -1 before the first */
};

/* A packet that wire_decode found good; borrows the caller's bytes. */
struct wire_packet_view {
    struct wire_header header;
    const uint8_t     *patches;      /* where the patch records begin */
};

/* Where a walk over patches stands, and the patch it stands on. */
struct wire_patch_cursor {
    const uint8_t *next_record;
    uint32_t patches_left;
    uint16_t patch_id;               /* 0..4095 */
    uint8_t  feature_count;          /* of this patch, 1..85 */
    uint8_t  features_left;
    uint8_t  fraction_bits;
    uint8_t  next_index;
    const uint8_t *mask;             /* presence of features: see WIRE.md */
    const uint8_t *next_feature;
};

/* One sentence for a status, without a full stop. Never null. */
const char *wire_status_text(enum wire_status status);

/* Starts a packet in `bytes`, which must stay until wire_finish. WIRE_OK, WIRE_FULL where not
 * even the header fits, or what is wrong with the header; other than WIRE_OK there is no packet
 * and wire_finish gives 0. WIRE_PACKET_BYTES_LEVEL_2 bytes hold any frame of a level-2 target. */
enum wire_status wire_begin(struct wire_writer *writer, uint8_t *bytes, size_t capacity,
                            const struct wire_header *header);

/* Adds one patch with 1..85 features in ascending order of index. Patches come in ascending order
 * of id. Positions are rounded to the wire's step; sigma and size to the nearest code,
 * saturating. Other than WIRE_OK the patch is left out whole and the packet stays good. After
 * WIRE_FULL every further patch is refused with WIRE_FULL, and the packet carries
 * WIRE_TRUNCATED_PACKET. */
enum wire_status wire_put_patch(struct wire_writer *writer, uint16_t patch_id,
                                const struct wire_feature *features, size_t count);

/* Ends the packet: counts, length, checksum. Bytes written, or 0 where wire_begin failed. */
size_t wire_finish(struct wire_writer *writer);

/* Length of the packet that begins with `prefix`, for readers of a stream: at least
 * WIRE_HEADER_BYTES, at most WIRE_PACKET_BYTES_MAX. 0 where no packet of any version begins so. */
size_t wire_packet_bytes(const uint8_t prefix[WIRE_PREFIX_BYTES]);

/* Checks a whole packet of exactly `count` bytes, all of it; `view` is set only with WIRE_OK. No bytes at all
 * (count 0, where NULL will do) are WIRE_SHORT. */
enum wire_status wire_decode(const uint8_t *bytes, size_t count, struct wire_packet_view *view);

/* Begins a walk before the first patch. */
struct wire_patch_cursor wire_patches(const struct wire_packet_view *view);

/* Steps to the next patch, ids ascending; false after the last. */
bool wire_next_patch(struct wire_patch_cursor *cursor);

/* Steps to the next feature of the cursor's patch, indices ascending; false after the last. */
bool wire_next_feature(struct wire_patch_cursor *cursor, struct wire_feature *feature);

/* Fraction bits of positions in an image whose longer side is `side_px` (1..32768): 12 for 1920. */
uint8_t wire_fraction_bits(uint32_t side_px);

#ifdef __cplusplus
}
#endif

#endif
