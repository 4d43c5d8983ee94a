// Every operation of math/net.h against loops over 16 numbers, for float and double.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <random>
#include <vector>

#include "limitray/math/net.h"

namespace limitray {
namespace {

template <class T>
class NetTest : public testing::Test {
 protected:
  std::mt19937 generator{7};

  std::vector<T> random_values(int n = 16) {
    std::uniform_real_distribution<double> u(-2, 2);
    std::vector<T> v(static_cast<std::size_t>(n));
    for (T& x : v) x = T(u(generator));
    return v;
  }
  static Net<T> net(const std::vector<T>& v) { return load_net(v.data()); }
  static std::vector<T> values(const Net<T>& n) {
    std::vector<T> v(16);
    store_net(v.data(), n);
    return v;
  }
  /// The 16 values f(row, column).
  static std::vector<T> table(const std::function<T(int, int)>& f) {
    std::vector<T> v;
    for (int j = 0; j < 4; ++j)
      for (int i = 0; i < 4; ++i) v.push_back(f(j, i));
    return v;
  }
  static std::vector<T> lanes(const Quad<T>& q) { return {q[0], q[1], q[2], q[3]}; }
};
using Types = testing::Types<float, double>;
TYPED_TEST_SUITE(NetTest, Types);

TYPED_TEST(NetTest, StoreGivesBackWhatLoadTook) {
  const auto v = this->random_values();
  EXPECT_EQ(this->values(this->net(v)), v);
}

TYPED_TEST(NetTest, ArithmeticWorksLaneByLane) {
  using T = TypeParam;
  const auto a = this->random_values(), b = this->random_values();
  const auto x = this->net(a), y = this->net(b);
  const auto at = [](const std::vector<T>& v, int j, int i) { return v[std::size_t(4 * j + i)]; };
  const auto expect = [&](const Net<T>& got, auto f) {
    EXPECT_EQ(this->values(got),
              this->table([&](int j, int i) { return f(at(a, j, i), at(b, j, i)); }));
  };
  expect(x + y, [](T p, T q) { return p + q; });
  expect(x - y, [](T p, T q) { return p - q; });
  expect(x * y, [](T p, T q) { return p * q; });
  expect(x + T(0.3), [](T p, T) { return p + T(0.3); });
  expect(x - T(0.3), [](T p, T) { return p - T(0.3); });
  expect(T(0.3) * x, [](T p, T) { return T(0.3) * p; });
  expect(abs(x), [](T p, T) { return std::abs(p); });
  expect(max(x, y), [](T p, T q) { return std::max(p, q); });
}

TYPED_TEST(NetTest, ColumnsAndRowsMoveAsNamed) {
  using T = TypeParam;
  const auto a = this->random_values();
  const auto x = this->net(a);
  const auto at = [&](int j, int i) { return a[std::size_t(4 * j + i)]; };
  const int order[4] = {3, 0, 0, 2};
  EXPECT_EQ(this->values(permute_columns<3, 0, 0, 2>(x)),
            this->table([&](int j, int i) { return at(j, order[i]); }));
  EXPECT_EQ(this->values(permute_rows<3, 0, 0, 2>(x)),
            this->table([&](int j, int i) { return at(order[j], i); }));

  const auto q = this->random_values(4);
  const Quad<T> quad4 = load_quad(q.data());
  EXPECT_EQ(this->values(along_rows<T>(quad4)),
            this->table([&](int, int i) { return q[std::size_t(i)]; }));
  EXPECT_EQ(this->values(along_columns<T>(quad4)),
            this->table([&](int j, int) { return q[std::size_t(j)]; }));
  std::vector<T> interior(16);
  interior[5] = q[0], interior[6] = q[1], interior[10] = q[2], interior[9] = q[3];
  EXPECT_EQ(this->values(at_interior<T>(quad4)), interior);
}

TYPED_TEST(NetTest, ReductionsSeeAllLanes) {
  using T = TypeParam;
  for (int place = 0; place < 16; ++place) {
    auto a = this->random_values();
    a[std::size_t(place)] = 5;
    EXPECT_EQ(max_value(this->net(a)), T(5)) << place;
    EXPECT_EQ(max_rows(this->net(a))[place % 4], T(5)) << place;
  }
  const auto a = this->random_values();
  const Quad<T> columns = sum_rows(this->net(a));
  T tolerance = 8 * std::numeric_limits<T>::epsilon();
  for (int i = 0; i < 4; ++i)
    EXPECT_NEAR(
        columns[i],
        a[std::size_t(i)] + a[std::size_t(4 + i)] + a[std::size_t(8 + i)] + a[std::size_t(12 + i)],
        tolerance);
}

TYPED_TEST(NetTest, ComparesAreStrictAndFailOnNaN) {
  using T = TypeParam;
  const T nan = std::numeric_limits<T>::quiet_NaN();
  const std::vector<T> ones(16, T(1));
  EXPECT_TRUE(all_above(this->net(ones), T(0.5)));
  EXPECT_FALSE(all_above(this->net(ones), T(1)));
  EXPECT_TRUE(all_below(this->net(ones), T(1.5)));
  EXPECT_FALSE(all_below(this->net(ones), T(1)));
  EXPECT_FALSE(all_above(this->net(ones), nan));
  EXPECT_FALSE(all_below(this->net(ones), nan));
  for (std::size_t place = 0; place < 16; ++place)
    for (const T odd : {T(-3), T(3), nan}) {
      auto a = ones;
      a[place] = odd;
      EXPECT_EQ(all_above(this->net(a), T(0.5)), odd > T(0.5)) << place;
      EXPECT_EQ(all_below(this->net(a), T(1.5)), odd < T(1.5)) << place;
    }
}

TYPED_TEST(NetTest, QuadsReduceToTheRightLanes) {
  using T = TypeParam;
  std::vector<std::vector<T>> v;
  Quad<T> q[4];
  for (int k = 0; k < 4; ++k) {
    v.push_back(this->random_values(4));
    q[k] = load_quad(v.back().data());
  }
  const Quad<T> sums = sum4(q[0], q[1], q[2], q[3]), tops = max4(q[0], q[1], q[2], q[3]);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_NEAR(sums[int(k)], v[k][0] + v[k][1] + v[k][2] + v[k][3],
                16 * std::numeric_limits<T>::epsilon());
    EXPECT_NEAR(sum(q[k]), sums[int(k)], 16 * std::numeric_limits<T>::epsilon());
    EXPECT_EQ(tops[int(k)], *std::max_element(v[k].begin(), v[k].end()));
  }
}

}  // namespace
}  // namespace limitray
