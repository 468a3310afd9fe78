#include "field/sampling/resample.h"

namespace tomofield::field {
namespace {

// The places of vertex i of n in the two halves of its axis.
struct Sources {
  int count = 0;
  int half[2] = {0, 0};
  int index[2] = {0, 0};

  Sources(int i, int n) {
    if (n == 1) {  // independent of the axis: the mean of both halves
      count = 2;
      half[1] = 1;
      return;
    }
    if (2 * i <= n - 1) add(0, 2 * i);
    if (2 * i >= n - 1) add(1, 2 * i - (n - 1));
  }

 private:
  void add(int h, int at) {
    half[count] = h;
    index[count++] = at;
  }
};

}  // namespace

void join_quarters(const Quarters& quarters, const ArrayExtents& e, float* joined) {
  for (int i = 0; i < e.x; ++i) {
    const Sources in_x(i, e.x);
    for (int j = 0; j < e.y; ++j) {
      const Sources in_y(j, e.y);
      const float weight = 1.0f / static_cast<float>(in_x.count * in_y.count);
      for (int m = 0; m < e.middle; ++m) {
        const auto at = [&](int x, int y) {
          return ((static_cast<std::ptrdiff_t>(x) * e.middle + m) * e.y + y) * e.inner;
        };
        float* out = joined + at(i, j);
        for (int c = 0; c < e.inner; ++c) {
          float sum = 0.0f;
          for (int a = 0; a < in_x.count; ++a) {
            for (int b = 0; b < in_y.count; ++b)
              sum += quarters[static_cast<std::size_t>(in_x.half[a] + 2 * in_y.half[b])]
                             [at(in_x.index[a], in_y.index[b]) + c];
          }
          out[c] = weight * sum;
        }
      }
    }
  }
}

}  // namespace tomofield::field
