/* Reads the settings once, and the folder at the first open. */
#include "tools/v4l2_shim/shim_device.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include "tools/v4l2_shim/answers.h"
#include "tools/v4l2_shim/delivery.h"
#include "tools/v4l2_shim/faults.h"
#include "tools/v4l2_shim/opens.h"
#include "tools/v4l2_shim/shim_env.h"
#include "tools/v4l2_shim/vqueue.h"

enum { VIDEO_MAJOR = 81 };

static pthread_once_t settings_once = PTHREAD_ONCE_INIT;
static struct shim_env settings;
static char uevent_path[64];

static pthread_once_t folder_once = PTHREAD_ONCE_INIT;
static struct folder folder;
static bool folder_fine;
static struct faults faults;

static void read_settings(void)
{
    settings = shim_env_get();
    (void)snprintf(uevent_path, sizeof uevent_path, "/sys/dev/char/%d:%d/uevent", VIDEO_MAJOR,
                   settings.minor);
}

static void read_folder(void)
{
    char sentence[SENTENCE_BYTES];
    folder_fine = folder_open(&folder, settings.frames, settings.raw ? &settings.raw_format : NULL,
                              sentence);
    folder_fine = folder_fine && (settings.faults == NULL ||
                                  faults_read(settings.faults, &faults, sentence));
    if (folder_fine) {
        answers_start(&folder, settings.period_ns);
        delivery_start(&folder, &faults, settings.period_ns, settings.once);
    } else {
        (void)fprintf(stderr, "tessera-replay: %s\n", sentence);
    }
}

static bool is_shown(void)
{
    (void)pthread_once(&settings_once, read_settings);
    return settings.frames != NULL && settings.minor >= 0;
}

bool shim_device_is(const char *path)
{
    return path != NULL && strncmp(path, "/dev/", 5) == 0 && is_shown() &&
           strcmp(path, settings.device) == 0;
}

bool shim_device_is_uevent(const char *path)
{
    return path != NULL && strncmp(path, "/sys/", 5) == 0 && is_shown() &&
           strcmp(path, uevent_path) == 0;
}

int shim_device_open_uevent(void)
{
    const int fd = memfd_create("uevent", MFD_CLOEXEC);
    char text[96];
    const int bytes =
        snprintf(text, sizeof text, "MAJOR=%d\nMINOR=%d\nDEVNAME=%s\n", VIDEO_MAJOR, settings.minor,
                 settings.device + strlen("/dev/"));
    if (fd >= 0 && (write(fd, text, (size_t)bytes) != bytes || lseek(fd, 0, SEEK_SET) != 0)) {
        (void)close(fd);
        return -1;
    }
    return fd;
}

int shim_device_open(int flags)
{
    (void)pthread_once(&folder_once, read_folder);
    if (!folder_fine) {
        errno = ENODEV;
        return -1;
    }
    return opens_add(flags);
}

void shim_device_closing(int fd)
{
    opens_forget(fd, vqueue_leave);
}

void shim_device_stat(struct stat *out)
{
    *out = (struct stat){
        .st_mode = S_IFCHR | 0660,
        .st_nlink = 1,
        .st_rdev = makedev(VIDEO_MAJOR, (unsigned int)settings.minor),
        .st_blksize = 4096,
        .st_ino = (ino_t)(1000 + settings.minor),
        .st_uid = getuid(),
        .st_gid = getgid(),
    };
}
