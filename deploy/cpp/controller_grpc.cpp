// A controller in C++17 that reads the force over the service. It has neither TLS nor a token: of another machine only where that
// daemon allows it (`insecure:`), else give the channel `grpc::SslCredentials`.
//
// usage: controller_grpc [ADDRESS [PATCH [SECONDS]]]      (127.0.0.1:50051, the only patch, for ever)
// It shows what it has twice a second. Exit code 3 if the last reading was no force.
//
// A thread of its own keeps the newest sample, so that the control loop never waits. taxel_force_judge says whether it is a
// force. Its age is the age when it was sent, plus the time that it was on its way, by the wall clocks of both machines, plus
// the time since it came. Another machine than the daemon's needs NTP or PTP.
#include <grpcpp/grpcpp.h>
#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "taxel/v1/force.grpc.pb.h"
#include "taxel_force.h"

using namespace std::chrono_literals;

/// By a clock that goes on while this machine is suspended: a force from before is old then.
static double now_s() { return static_cast<double>(taxel_force_now_ns()) * 1e-9; }

/// For how long a sample that just came was on its way; 0 where the daemon's wall clock is ahead of ours.
static double on_the_way_s(const taxel::v1::ForceSample& sample) {
    if (!sample.has_sent()) return std::numeric_limits<double>::infinity();
    const double sent_s = static_cast<double>(sample.sent().seconds()) + sample.sent().nanos() * 1e-9;
    const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
    return std::max(0.0, std::chrono::duration<double>(since_1970).count() - sent_s);
}

/// A force, or why there is none.
struct Reading {
    std::optional<double> total_n;
    double age_s = 0.0;
    std::string why;
};

class Forces {
public:
    Forces(const std::string& address, std::string patch) : patch_(std::move(patch)) {
        grpc::ChannelArguments arguments;
        arguments.SetInt(GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES, 4096);  // what is not read waits at the daemon
        arguments.SetInt(GRPC_ARG_HTTP2_BDP_PROBE, 0);
        arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 5000);
        // Left alone, gRPC waits up to two minutes before it tries a daemon again that was away.
        arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
        arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 100);
        arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2000);
        // gRPC would take a socket's path for the authority of each call, which HTTP/2 does not allow and the daemon refuses.
        if (address.rfind("unix:", 0) == 0) arguments.SetString(GRPC_ARG_DEFAULT_AUTHORITY, "localhost");
        auto channel = grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
        stub_ = taxel::v1::ForceService::NewStub(channel);
        thread_ = std::thread([this] { follow(); });
    }

    ~Forces() {
        {
            const std::lock_guard<std::mutex> lock(mutex_);
            ended_ = true;
            if (context_) context_->TryCancel();
        }
        thread_.join();
    }

    Forces(const Forces&) = delete;
    Forces& operator=(const Forces&) = delete;

    /// The newest force, if it may be acted on now; it waits for nothing but a lock that is held for a copy.
    Reading force() {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (!newest_) return {std::nullopt, 0.0, broken_.empty() ? "no sample yet" : broken_};
        const auto& sample = newest_->sample;
        const double waited_s = newest_->on_the_way_s + now_s() - newest_->came_s;
        const double total_n = sample.has_total_n() ? sample.total_n() : NAN, age_s = sample.has_age_s() ? sample.age_s() : NAN;
        const auto status = taxel_force_judge(static_cast<uint32_t>(sample.state()), total_n, age_s, waited_s, sample.max_age_s(), NAN);
        if (status == TAXEL_FORCE_GOOD) return {total_n, age_s + waited_s, ""};
        // What the daemon said last is no reason any more once it cannot be heard.
        if (!broken_.empty()) return {std::nullopt, 0.0, "the stream was lost: " + broken_};
        if (status != TAXEL_FORCE_STATE) return {std::nullopt, age_s + waited_s, taxel_force_words(status)};
        const auto& reasons = sample.reasons();
        return {std::nullopt, 0.0, taxel::v1::ForceState_Name(sample.state()) + (reasons.empty() ? "" : ": " + reasons[0])};
    }

private:
    struct Newest {
        taxel::v1::ForceSample sample;
        double came_s;
        double on_the_way_s;
    };

    grpc::Status read(grpc::ClientContext& context) {
        taxel::v1::StreamRequest request;
        request.set_patch(patch_);
        request.set_rate_hz(200.0);
        auto stream = stub_->StreamForce(&context, request);
        taxel::v1::ForceSample sample;
        while (stream->Read(&sample)) {
            const std::lock_guard<std::mutex> lock(mutex_);
            newest_ = Newest{sample, now_s(), on_the_way_s(sample)};
            broken_.clear();
        }
        return stream->Finish();
    }

    void follow() {
        for (auto pause = 50ms;; pause = std::min(2 * pause, std::chrono::milliseconds(2000))) {
            auto context = std::make_unique<grpc::ClientContext>();
            {
                const std::lock_guard<std::mutex> lock(mutex_);
                if (ended_) return;
                context_ = context.get();
            }
            const auto status = read(*context);
            {
                const std::lock_guard<std::mutex> lock(mutex_);
                context_ = nullptr;
                broken_ = status.ok() ? "the daemon ended the stream" : status.error_message();
                if (ended_) return;
            }
            std::this_thread::sleep_for(pause);
        }
    }

    const std::string patch_;
    std::unique_ptr<taxel::v1::ForceService::Stub> stub_;
    std::mutex mutex_;  // of what follows
    std::optional<Newest> newest_;
    std::string broken_;
    grpc::ClientContext* context_ = nullptr;
    bool ended_ = false;
    std::thread thread_;
};

int main(int argc, char** argv) {
    Forces forces(argc > 1 ? argv[1] : "127.0.0.1:50051", argc > 2 ? argv[2] : "");
    const double seconds = argc > 3 ? std::stod(argv[3]) : std::numeric_limits<double>::infinity();
    bool good = false;
    for (unsigned long cycle = 0; static_cast<double>(cycle) < seconds * 100.0; cycle++) {
        std::this_thread::sleep_for(10ms);
        const auto reading = forces.force();
        good = reading.total_n.has_value();
        // Here the controller acts.
        if (cycle % 50 == 0) {
            if (good) std::printf("%6.2f N, %3.0f ms old\n", *reading.total_n, reading.age_s * 1e3);
            else std::printf("no force: %s\n", reading.why.c_str());
            std::fflush(stdout);
        }
    }
    return good ? 0 : 3;
}
