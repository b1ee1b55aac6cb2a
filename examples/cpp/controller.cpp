// The controller in C++17: the header is C++-clean, the sources stay C99 (compiled as C++ CasADi's file takes other paths).
#include <array>
#include <cstdio>
#include <stdexcept>

#include "springline.h"

namespace {

class Controller {
 public:
  explicit Controller(const springline_config &config = springline_default_config) {
    check(springline_init(&controller_, &config));
  }

  // Between two steps; a configuration that is refused is not taken, and the controller goes on as it was.
  [[nodiscard]] int retune(const springline_config &config) noexcept {
    return springline_set_parameters(&controller_, &config);
  }

  // A new task: the last command is forgotten, the configuration stays.
  void reset() { check(springline_reset(&controller_)); }

  // A fault is the caller's to judge, so it is returned, with the fallback in the command.
  [[nodiscard]] int step(const springline_reference &reference, const springline_measurement &measurement,
                         springline_command &command) noexcept {
    return springline_step(&controller_, &reference, &measurement, &command, nullptr);
  }

  void advance(springline_state &arm, const springline_command &command, const std::array<springline_base, 3> &base,
               double seconds) const {
    check(springline_plant_step(&controller_, &arm, &command, base.data(), seconds));
  }

  springline_state start() const {
    springline_state arm;
    check(springline_start(&controller_, &arm));
    return arm;
  }

  springline_reference reference(double t) const {
    springline_reference wanted;
    springline_base base;
    check(springline_signals(&controller_, t, &wanted, &base));
    return wanted;
  }

 private:
  static void check(int status) {
    if (status != SPRINGLINE_OK) throw std::runtime_error(springline_status_text(status));
  }

  springline_controller controller_;
};

}  // namespace

int main() try {
  Controller controller;
  springline_config config = springline_default_config;
  springline_state arm = controller.start();
  springline_command command{};
  const std::array<springline_base, 3> rolling_deck = [] {
    springline_base base{};
    base.theta_1x = 0.05;  // heeled, not moving
    return std::array{base, base, base};
  }();
  for (int k = 0; k <= 1000; k++) {
    if (k == 300) {
      // On the way: an export with --tunable has its numbers here too, config.parameters.control_mu_lift and so on.
      config.fallback = SPRINGLINE_FALLBACK_LAST;
      std::printf("retuned: %s\n", springline_status_text(controller.retune(config)));
      springline_config wrong = config;
      wrong.fallback = 7;
      std::printf("refused, and nothing changed: %s\n", springline_status_text(controller.retune(wrong)));
    }
    const springline_reference wanted = controller.reference(1e-3 * k);
    const springline_measurement measured{arm.q1_lift,      arm.q1_rotation, arm.dq1_lift,
                                          arm.dq1_rotation, arm.dq2_lift,    arm.dq2_rotation};
    if (const int status = controller.step(wanted, measured, command); status != SPRINGLINE_OK) {
      std::puts(springline_status_text(status));
      return 1;
    }
    if (k % 200 == 0) {
      std::printf("t = %.1f s: lift %9.6f m, rotation %9.6f rad\n", 1e-3 * k, arm.q1_lift, arm.q1_rotation);
    }
    for (int j = 0; j < 10; j++) controller.advance(arm, command, rolling_deck, 1e-4);
  }
  controller.reset();
  return 0;
} catch (const std::exception &error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
