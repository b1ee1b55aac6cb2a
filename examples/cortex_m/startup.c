/* Vector table and reset for the MPS2 boards under qemu: memory, FPU, semihosting, then main. */
#include <stdint.h>
#include <stdlib.h>

extern uint32_t data_source[], data_start[], data_end[], bss_start[], bss_end[], stack_top[];
extern int main(int argc, char **argv);
void reset(void);
void _init(void);
void _fini(void);
#ifdef SEMIHOSTING
extern void initialise_monitor_handles(void);
#endif

void _init(void) {}
void _fini(void) {}

static void fault(void) {
#ifdef SEMIHOSTING
  _Exit(3);
#else
  for (;;) continue;
#endif
}

void reset(void) {
  volatile uint32_t *const access_control = (volatile uint32_t *)0xE000ED88u; /* CPACR */
  uint32_t *from = data_source, *to;
  *access_control |= 0xFu << 20; /* the FPU, for everybody */
  __asm__ volatile("dsb\n\tisb");
  for (to = data_start; to < data_end; to++) *to = *from++;
  for (to = bss_start; to < bss_end; to++) *to = 0;
#ifdef SEMIHOSTING
  initialise_monitor_handles();
  exit(main(0, 0));
#else
  (void)main(0, 0);
  for (;;) continue;
#endif
}

typedef void (*handler)(void);

static const struct {
  uint32_t *stack;
  handler handlers[15];
} vectors __attribute__((section(".vectors"), used)) = {
    stack_top,
    {reset, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault},
};
