// A controller in C++17 that reads the force over the service. It has neither TLS nor a token: of another machine only where that
// daemon allows it (`insecure:`), else give the channel `grpc::SslCredentials`.
//
// usage: controller_grpc [ADDRESS [PATCH [SECONDS]]]      (127.0.0.1:50051, the only patch, for ever)
// It shows what it has twice a second. Exit code 3 if the last reading was no force.
//
// A thread of its own keeps the newest sample, so that the control loop never waits. Only OK and DEGRADED are forces. The
// age is the sample's age when it was sent, plus the time since it came, plus the time that it can have been on its way:
// the daemon is asked once in a while, and answered not before the question left.
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

using namespace std::chrono_literals;

constexpr double drift = 6e-4;       // two clocks part by so many seconds a second at most
constexpr double astray_s = 0.05;    // on clocks that run no sample comes so long before it was sent

/// By a clock that goes on while this machine sleeps, as that of another machine does: a force from before is old then.
static double now_s() {
#ifdef CLOCK_BOOTTIME
    constexpr clockid_t with_sleep = CLOCK_BOOTTIME;
#else
    constexpr clockid_t with_sleep = CLOCK_MONOTONIC;  // of a system without that clock
#endif
    timespec now{};
    clock_gettime(with_sleep, &now);
    return static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec) * 1e-9;
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
        const bool good = sample.state() == taxel::v1::FORCE_STATE_OK || sample.state() == taxel::v1::FORCE_STATE_DEGRADED;
        if (!good || !sample.has_total_n() || !sample.has_age_s() || !std::isfinite(sample.total_n()))
            // What the daemon said last is no reason any more once it cannot be heard.
            return {std::nullopt, 0.0,
                    !broken_.empty() ? "the stream was lost: " + broken_ :
                    taxel::v1::ForceState_Name(sample.state()) + (sample.reasons_size() ? ": " + sample.reasons(0) : "")};
        const double age_s = sample.age_s() + newest_->on_the_way_s + now_s() - newest_->came_s;
        if (!(age_s >= 0.0 && age_s <= sample.max_age_s()))
            return {std::nullopt, age_s, broken_.empty() ? "too old" : "the stream was lost: " + broken_};
        return {sample.total_n(), age_s, ""};
    }

private:
    struct Newest {
        taxel::v1::ForceSample sample;
        double came_s;
        double on_the_way_s;
    };

    /// The least that our clock less the daemon's can be, and when that was found.
    struct Known {
        double value_s = -std::numeric_limits<double>::infinity();
        double found_s = 0.0;
        double least_s(double at_s) const { return value_s - drift * std::max(0.0, at_s - found_s); }
    };

    static bool sent_s(const taxel::v1::ForceSample& sample, double& sent) {
        if (!sample.has_monotonic_ns() || !sample.has_age_s()) return false;
        sent = static_cast<double>(sample.monotonic_ns()) * 1e-9 + sample.age_s();
        return std::isfinite(sent);
    }

    /// Bounds the daemon's clock: the answer was sent after the question left.
    grpc::Status look_at_the_clock() {
        grpc::ClientContext context;
        context.set_deadline(std::chrono::system_clock::now() + 2s);
        taxel::v1::GetForceRequest request;
        request.set_patch(patch_);
        taxel::v1::ForceSample answer;
        const double left_s = now_s();
        const auto status = stub_->GetForce(&context, request, &answer);
        double sent;
        if (status.ok() && sent_s(answer, sent) && left_s - sent > now_known_.least_s(left_s)) {
            if (!std::isinf(now_known_.value_s)) {
                before_ = now_known_;
                before_until_s_ = sent;
            }
            now_known_ = {left_s - sent, left_s};
        }
        asked_s_ = now_s();
        return status;
    }

    /// How long a sample was on its way at most. Where the daemon's clock stood still, as in a sleep of its machine, the last
    /// answer says nothing of samples that were sent before.
    double on_the_way_s(double came_s, double sent_s) {
        const auto& known = sent_s < before_until_s_ ? before_ : now_known_;
        const double took_s = came_s - sent_s - known.least_s(came_s);
        if (took_s < -astray_s) {  // our clock has stood still: nothing is known of the daemon's any more
            forget_the_clock();
            return std::numeric_limits<double>::infinity();
        }
        return std::max(0.0, took_s);
    }

    void forget_the_clock() {
        now_known_ = before_ = Known{};
        before_until_s_ = -std::numeric_limits<double>::infinity();
    }

    grpc::Status read(grpc::ClientContext& context) {
        forget_the_clock();
        if (const auto status = look_at_the_clock(); !status.ok()) return status;
        taxel::v1::StreamForceRequest request;
        request.set_patch(patch_);
        request.set_rate_hz(200.0);
        auto stream = stub_->StreamForce(&context, request);
        taxel::v1::ForceSample sample;
        while (stream->Read(&sample)) {
            const double came_s = now_s();
            double sent = 0.0, way_s = std::numeric_limits<double>::infinity();
            const bool timed = sent_s(sample, sent);
            if (came_s - asked_s_ > 10.0 || (timed && std::isinf(now_known_.value_s)))
                if (const auto status = look_at_the_clock(); !status.ok()) {
                    context.TryCancel();
                    stream->Finish();
                    return status;
                }
            if (timed) way_s = on_the_way_s(came_s, sent);
            const std::lock_guard<std::mutex> lock(mutex_);
            newest_ = Newest{sample, came_s, way_s};
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
    std::mutex mutex_;  // of what follows, up to the thread's own
    std::optional<Newest> newest_;
    std::string broken_;
    grpc::ClientContext* context_ = nullptr;
    bool ended_ = false;
    // The thread's own.
    Known now_known_, before_;  // before_: until the last answer that raised it, which was sent at before_until_s_
    double before_until_s_ = -std::numeric_limits<double>::infinity(), asked_s_ = 0.0;
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
