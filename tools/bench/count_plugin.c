/* A plug-in for QEMU's user emulation (API version 1) that counts executed instructions and prints the sum at
 * exit. Debian packages no header for it, so the five functions used are declared here. */
#include <stdint.h>
#include <stdio.h>

typedef uint64_t plugin_id;
struct block;

extern void   qemu_plugin_register_vcpu_tb_trans_cb(plugin_id id,
                                                    void (*on_block)(plugin_id, struct block *));
extern size_t qemu_plugin_tb_n_insns(const struct block *block);
extern void   qemu_plugin_register_vcpu_tb_exec_inline(struct block *block, int add_u64, void *sum,
                                                       uint64_t step);
extern void   qemu_plugin_register_atexit_cb(plugin_id id, void (*at_exit)(plugin_id, void *),
                                             void *data);

__attribute__((visibility("default"))) extern int qemu_plugin_version;
int qemu_plugin_version = 1;
int qemu_plugin_install(plugin_id id, const void *info, int argc, char **argv);

static uint64_t executed;

static void on_block(plugin_id id, struct block *block)
{
    (void)id;
    qemu_plugin_register_vcpu_tb_exec_inline(block, 0, &executed, qemu_plugin_tb_n_insns(block));
}

static void at_exit(plugin_id id, void *data)
{
    (void)id;
    (void)data;
    (void)fprintf(stderr, "executed %llu\n", (unsigned long long)executed);
}

int qemu_plugin_install(plugin_id id, const void *info, int argc, char **argv)
{
    (void)info;
    (void)argc;
    (void)argv;
    qemu_plugin_register_vcpu_tb_trans_cb(id, on_block);
    qemu_plugin_register_atexit_cb(id, at_exit, NULL);
    return 0;
}
