// Threads that ask for samples before any sampler was fitted, all at once: threads PATH
#include "sommerl.hpp"

#include <thread>

int main(int, char** arguments) {
    const auto brdf = sommerl::Brdf::load(arguments[1]);
    std::array<float, 6> pdf{};
    std::vector<std::thread> threads;
    for (float& found : pdf) threads.emplace_back([&brdf, &found] { found = brdf.pdf({0.6f, 0, 0.8f}, {0, 0.6f, 0.8f}); });
    for (auto& thread : threads) thread.join();
    for (const float found : pdf)
        if (!(found > 0 && found == pdf[0])) return 1;
    return brdf ? 0 : 1;
}
