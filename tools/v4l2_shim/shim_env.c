/* Settings to and from the environment. */
#include "tools/v4l2_shim/shim_env.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int shim_env_device_number(const char *text)
{
    static const char prefix[] = "/dev/video";
    if (strncmp(text, prefix, strlen(prefix)) != 0) {
        return -1;
    }
    const char *const digits = text + strlen(prefix);
    const size_t count = strspn(digits, "0123456789");
    if (count < 1 || count > 3 || digits[count] != '\0' || (digits[0] == '0' && count > 1)) {
        return -1;
    }
    const int number = atoi(digits);
    return number < 256 ? number : -1;
}

int64_t shim_env_period_ns(const char *text)
{
    char *end = NULL;
    const double fps = strtod(text, &end);
    if (end == text || *end != '\0' || !(fps >= 0.001 && fps <= 100000)) {
        return 0;
    }
    return (int64_t)(1e9 / fps + 0.5);
}

struct shim_env shim_env_get(void)
{
    struct shim_env settings = {.frames = getenv(SHIM_ENV_FRAMES),
                                .device = getenv(SHIM_ENV_DEVICE)};
    if (settings.device == NULL) {
        settings.device = "/dev/video0";
    }
    settings.minor = shim_env_device_number(settings.device);
    const char *const fps = getenv(SHIM_ENV_FPS);
    settings.period_ns = fps == NULL ? 0 : shim_env_period_ns(fps);
    settings.once = getenv(SHIM_ENV_ONCE) != NULL;
    settings.faults = getenv(SHIM_ENV_FAULTS);
    const char *const raw = getenv(SHIM_ENV_RAW);
    struct folder_format *const format = &settings.raw_format;
    char detail[SENTENCE_BYTES];
    settings.raw = raw != NULL &&
                   sscanf(raw, "%" SCNu32 " %" SCNu32 " %" SCNu32 " %" SCNu32, &format->fourcc,
                          &format->width_px, &format->height_px, &format->stride_bytes) == 4 &&
                   folder_complete_format(format, detail);
    return settings;
}

/* A setting left from an outer tessera-replay must not reach the inner one's command. */
static bool put(const char *name, const char *value)
{
    return (value == NULL ? unsetenv(name) : setenv(name, value, 1)) == 0;
}

bool shim_env_put(const struct shim_env *settings, const char *fps)
{
    const struct folder_format *const format = &settings->raw_format;
    char raw[64];
    (void)snprintf(raw, sizeof raw, "%" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32, format->fourcc,
                   format->width_px, format->height_px, format->stride_bytes);
    return put(SHIM_ENV_FRAMES, settings->frames) && put(SHIM_ENV_DEVICE, settings->device) &&
           put(SHIM_ENV_FPS, fps) && put(SHIM_ENV_ONCE, settings->once ? "1" : NULL) &&
           put(SHIM_ENV_FAULTS, settings->faults) &&
           put(SHIM_ENV_RAW, settings->raw ? raw : NULL);
}
