// Reads a material, evaluates it, and estimates its albedo by sampling: c++ -std=c++17 -O2 example.cpp && ./a.out gold.smrl
#include "sommerl.hpp"

#include <cstdio>
#include <random>

int main(int count, char** arguments) {
    const auto brdf = sommerl::Brdf::load(count > 1 ? arguments[1] : "material.smrl");
    if (!brdf) {
        std::printf("%s\n", sommerl::message(brdf.error()));
        return 1;
    }
    const std::array<float, 3> wo{0.6f, 0, 0.8f}, f_r = brdf.eval({0, 0, 1}, wo);
    std::printf("%s: f_r = %g %g %g 1/sr\n", brdf.name().c_str(), f_r[0], f_r[1], f_r[2]);

    std::mt19937 random;
    std::uniform_real_distribution<float> uniform;
    const int samples = 20000;
    double sum = 0;
    for (int i = 0; i < samples; ++i) {
        std::array<float, 3> wi;
        float pdf;
        const auto weight = brdf.sample(wo, {uniform(random), uniform(random), uniform(random)}, &wi, &pdf);
        sum += double(weight[0] + weight[1] + weight[2]) / 3;  // f_r cos θ_i / pdf
    }
    std::printf("albedo = %g\n", sum / samples);
}
