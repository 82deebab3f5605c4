// A controller in C++17 that reads the force from shared memory a thousand times a second.
//
// usage: controller_cpp [PAGE [SECONDS]]      (/dev/shm/taxeld/left_forearm; for ever)
// It shows what it has twice a second. Exit code 3 if the last reading was no force.
#include <chrono>
#include <cstdio>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include "taxel_force.h"

/// The newest force of a patch. One for each thread that reads.
class Forces {
public:
    explicit Forces(const std::string& page) {
        if (taxel_force_init(&reader_, page.c_str()) != 0) throw std::invalid_argument(page + ": too long a path");
    }
    ~Forces() { taxel_force_close(&reader_); }
    Forces(const Forces&) = delete;
    Forces& operator=(const Forces&) = delete;

    /// The force, if it may be acted on now; it never waits.
    std::optional<taxel_force> force(std::chrono::nanoseconds age_limit) {
        taxel_force force;
        status_ = taxel_force_follow(&reader_, age_limit.count(), &force);
        if (status_ != TAXEL_FORCE_GOOD) return std::nullopt;
        return force;
    }

    /// Why there was none.
    const char* why() const { return taxel_force_words(status_); }

private:
    taxel_force_reader reader_;
    taxel_force_status status_ = TAXEL_FORCE_NO_PAGE;
};

int main(int argc, char** argv) {
    using namespace std::chrono_literals;
    Forces forces(argc > 1 ? argv[1] : "/dev/shm/taxeld/left_forearm");
    const double seconds = argc > 2 ? std::stod(argv[2]) : std::numeric_limits<double>::infinity();
    bool good = false;
    for (unsigned long cycle = 0; static_cast<double>(cycle) < seconds * 1000.0; cycle++) {
        const auto force = forces.force(std::chrono::nanoseconds(0));
        good = force.has_value();
        // Here the controller acts on force->total_n, or does without.
        if (cycle % 500 == 0) {
            if (force)
                std::printf("%6.2f N, %3.0f ms old\n", force->total_n, static_cast<double>(force->age_ns) * 1e-6);
            else
                std::printf("no force: %s\n", forces.why());
            std::fflush(stdout);
        }
        std::this_thread::sleep_for(1ms);
    }
    return good ? 0 : 3;
}
