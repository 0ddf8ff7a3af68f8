/* See keysort.h. */
#include "firmware/detect/keysort.h"

static void sift_down(uint32_t keys[], uint32_t root, uint32_t count)
{
    const uint32_t key = keys[root];
    for (uint32_t child = 2 * root + 1; child < count; child = 2 * root + 1) {
        child += child + 1 < count && keys[child + 1] > keys[child] ? 1 : 0;
        if (keys[child] <= key) {
            break;
        }
        keys[root] = keys[child];
        root = child;
    }
    keys[root] = key;
}

void keysort(uint32_t keys[], uint32_t count)
{
    for (uint32_t i = count / 2; i-- > 0;) {
        sift_down(keys, i, count);
    }
    for (uint32_t last = count; last-- > 1;) {
        const uint32_t largest = keys[0];
        keys[0] = keys[last];
        keys[last] = largest;
        sift_down(keys, 0, last);
    }
}
