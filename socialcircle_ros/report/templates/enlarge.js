const enlarged = document.getElementById('enlarged');
document.querySelectorAll('button.enlarge').forEach((button) => {
  button.addEventListener('click', () => {
    enlarged.firstElementChild.src = button.firstElementChild.src;
    enlarged.firstElementChild.alt = button.firstElementChild.alt;
    enlarged.showModal();
  });
});
enlarged.addEventListener('click', () => enlarged.close());
