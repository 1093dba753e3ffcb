// Prints every estimate of a running rig: number, status, age when published and on arrival, and the beginning of theta.
//
//   subscribe [tcp/127.0.0.1:7447 [abs/demo/sheet/state [COUNT]]]
//
// The age is taken on the monotonic clock, so it is right on the host of the cameras.
#include <absmsg/v1/deformation_state.pb.h>
#include <zenoh-pico.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>

using absmsg::v1::DeformationState;

static void print(const DeformationState& state) {
  const std::chrono::nanoseconds now = std::chrono::steady_clock::now().time_since_epoch();
  const double age_ms = (now.count() - state.header().t_host_ns()) * 1e-6;
  std::printf("%6llu %-20s published %5.1f ms, here %5.1f ms  theta[%d] =",
              static_cast<unsigned long long>(state.header().seq()), DeformationState::Status_Name(state.status()).c_str(),
              state.age_ms(), age_ms, state.theta_size());
  for (int i = 0; i < state.theta_size() && i < 6; ++i) std::printf(" %+.3f", state.theta(i));
  std::printf("\n");
  std::fflush(stdout);
}

int main(int argc, char** argv) {
  const char* endpoint = argc > 1 ? argv[1] : "tcp/127.0.0.1:7447";
  const char* topic = argc > 2 ? argv[2] : "abs/demo/sheet/state";
  const int count = argc > 3 ? std::atoi(argv[3]) : 0;  // 0: until Ctrl-C

  z_owned_config_t config;
  z_config_default(&config);
  zp_config_insert(z_loan_mut(config), Z_CONFIG_MODE_KEY, "client");
  zp_config_insert(z_loan_mut(config), Z_CONFIG_CONNECT_KEY, endpoint);
  z_owned_session_t session;
  if (z_open(&session, z_move(config), nullptr) < 0) {
    std::fprintf(stderr, "nothing answers at %s: is abs-service running?\n", endpoint);
    return 1;
  }
  // A reader slower than the tracker loses the oldest, and is never a second late.
  z_owned_closure_sample_t closure;
  z_owned_ring_handler_sample_t newest;
  z_ring_channel_sample_new(&closure, &newest, 30);
  z_view_keyexpr_t key;
  z_owned_subscriber_t subscriber;
  if (z_view_keyexpr_from_str(&key, topic) < 0 ||
      z_declare_subscriber(z_loan(session), &subscriber, z_loan(key), z_move(closure), nullptr) < 0) {
    std::fprintf(stderr, "cannot subscribe to %s\n", topic);
    return 1;
  }
  z_owned_sample_t sample;
  for (int received = 0; (count == 0 || received < count) && z_recv(z_loan(newest), &sample) == Z_OK; ++received) {
    z_owned_slice_t bytes;
    z_bytes_to_slice(z_sample_payload(z_loan(sample)), &bytes);
    DeformationState state;
    if (state.ParseFromArray(z_slice_data(z_loan(bytes)), static_cast<int>(z_slice_len(z_loan(bytes))))) print(state);
    z_drop(z_move(bytes));
    z_drop(z_move(sample));
  }
  z_drop(z_move(subscriber));
  z_drop(z_move(newest));
  z_drop(z_move(session));
  return 0;
}
