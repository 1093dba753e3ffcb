// Prints every estimate of a running rig: sequence number, status, how old it is on arrival, and the beginning of theta.
//
//   subscribe [tcp/127.0.0.1:7447 [abs/demo/sheet/state [COUNT]]]
//
// The age is taken on the monotonic clock, so it is right on the host of the cameras.
#include <abs/v1/deformation_state.pb.h>
#include <zenoh-pico.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

static std::atomic<int> received{0};

static void on_sample(z_loaned_sample_t* sample, void*) {
  z_owned_slice_t bytes;
  z_bytes_to_slice(z_sample_payload(sample), &bytes);
  abs_service::v1::DeformationState state;
  const bool ok = state.ParseFromArray(z_slice_data(z_loan(bytes)), static_cast<int>(z_slice_len(z_loan(bytes))));
  z_drop(z_move(bytes));
  if (!ok) return;
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  const auto now_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
  const auto status = abs_service::v1::DeformationState::Status_Name(state.status());
  std::printf("%6llu %-20s %6.1f ms  theta[%d] =", static_cast<unsigned long long>(state.header().seq()), status.c_str(),
              (now_ns - state.header().t_host_ns()) * 1e-6, state.theta_size());
  for (int i = 0; i < state.theta_size() && i < 6; ++i) std::printf(" %+.3f", state.theta(i));
  std::printf("\n");
  std::fflush(stdout);
  ++received;
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
  z_view_keyexpr_t key;
  z_owned_closure_sample_t callback;
  z_owned_subscriber_t subscriber;
  z_closure(&callback, on_sample, nullptr, nullptr);
  if (z_view_keyexpr_from_str(&key, topic) < 0 ||
      z_declare_subscriber(z_loan(session), &subscriber, z_loan(key), z_move(callback), nullptr) < 0) {
    std::fprintf(stderr, "cannot subscribe to %s\n", topic);
    return 1;
  }
  while (count == 0 || received < count) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  z_drop(z_move(subscriber));
  z_drop(z_move(session));
  return 0;
}
